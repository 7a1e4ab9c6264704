"""`python -m fes_pin`: the command line."""

from fes_pin.cli.main import main

if __name__ == "__main__":
    main()
