"""Several aircraft that each fly their own companion and hear each other over a network of theirs."""
