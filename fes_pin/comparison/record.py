"""A comparison on disk: `compare.json`."""

from fes_pin.comparison.result import Comparison

FILE = "compare.json"
comparison_record, comparison_json = Comparison.record, Comparison.to_json
