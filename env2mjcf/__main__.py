"""Runs the command line: `python -m env2mjcf`, and the program `env2mjcf`."""

import sys

from .cli import program


def run() -> int:
    """Run the program, and return its exit status."""
    program.begin()
    try:
        from .cli.main import main

        return main()
    except KeyboardInterrupt:
        return program.interrupted_status()
    finally:
        # All is done: a signal while the interpreter tidies up must not print a traceback.
        program.end_at_once()


if __name__ == "__main__":
    sys.exit(run())
