"""A process that ends before it has begun, as where a library is missing."""

import sys

if __name__ == "__main__":
    sys.exit("libmissing.so: cannot open shared object file")
