"""Run the command line: ``python -m edgel``."""

from edgel._cli import app

if __name__ == "__main__":
    app()
