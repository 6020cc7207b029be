"""The command line as a module: `python -m forest`."""

from forest.cli import main

if __name__ == "__main__":
    main()
