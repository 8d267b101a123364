"""Formations in simulation: several aircraft that each run the product's engine, and a radio between them."""
