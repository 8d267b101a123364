"""The experiments of the paper's section 4, flown with the product's avoidance."""
