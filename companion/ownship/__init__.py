"""Our own aircraft: everything known about it, and how fresh it is."""
