"""A contrast on disk: `contrast.json` as the study format says."""

from fes_pin.contrasts.result import Contrast

FILE = "contrast.json"
contrast_record, contrast_json = Contrast.record, Contrast.to_json
