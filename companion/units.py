"""Constants of physics and of the separation standards, and units of measure in SI."""

STANDARD_GRAVITY_MPS2 = 9.80665
FOOT_M = 0.3048
KNOT_MPS = 1852.0 / 3600.0
# Near mid-air collision: 500 ft and 100 ft.
NMAC_HORIZONTAL_M, NMAC_VERTICAL_M = 152.4, 30.48
# Well clear for small UAS (ASTM F3442): 2000 ft and 250 ft.
WELL_CLEAR_HORIZONTAL_M, WELL_CLEAR_VERTICAL_M = 609.6, 76.2
