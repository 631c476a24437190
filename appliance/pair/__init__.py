"""The pair: two boxes and one show; the second follows the first, and takes over when it is silent."""
