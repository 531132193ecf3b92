"""`python -m pgfmd` is `pgfmd`."""

import sys

if __name__ == "__main__":
    # What a file of the current folder happens to be called, such as numpy.py, is of no concern here.
    if not sys.flags.safe_path:
        del sys.path[0]

    from pgfmd.cli import main

    main()
