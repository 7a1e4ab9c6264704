"""Runs the benchmarks and prints one table."""

import importlib.util
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / "tests"))  # the oracle, an independent simulator


def load(name: str):
    """The module of a benchmark."""
    spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def main() -> None:
    """Run the benchmarks that are named, or all."""
    known = sorted(p.stem for p in HERE.glob("*.py") if "\ndef run(" in p.read_text())
    wanted = sys.argv[1:] or known
    for name in wanted:
        if name not in known:
            sys.exit(f"no benchmark {name}; there are {', '.join(known)}")
    console = Console(width=130)
    for name in wanted:
        table = Table(title=name, title_justify="left")
        for column in ("what", "measured", "target", "unit"):
            table.add_column(column, justify="left" if column in {"what", "unit"} else "right")
        for what, measured, target, unit in load(name).run():
            table.add_row(what, f"{measured:.4g}", "" if target is None else f"{target:g}", unit)
        console.print(table)


if __name__ == "__main__":
    main()
