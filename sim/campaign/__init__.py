"""Campaigns: thousands of encounters through the product's engine, and the remaining risk."""
