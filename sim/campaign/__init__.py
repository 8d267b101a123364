"""Encounters by the thousand through the engine that flies: how safe it is, and at what price."""
