"""Everything that is known of our own aircraft, and how fresh it is."""
