"""The command line: `fes-pin`."""


def main() -> None:
    """Run the command line."""
