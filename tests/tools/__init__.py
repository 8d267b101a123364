"""Tools that measure the tree; the tests use some of them."""
