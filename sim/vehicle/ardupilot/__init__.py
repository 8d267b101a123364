"""ArduPlane's behaviour, as measured on its simulator."""
