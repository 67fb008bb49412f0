"""Lets ``python -m rtsim`` do what ``rtsim`` does."""

from rtsim.cli.main import main

if __name__ == "__main__":
    main()
