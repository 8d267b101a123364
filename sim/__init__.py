"""Everything that replaces the world: a fake vehicle that speaks MAVLink, traffic, scenarios, demos."""
