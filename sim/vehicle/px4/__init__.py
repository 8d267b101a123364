"""PX4's behaviour as a fixed wing, as measured on its simulator."""
