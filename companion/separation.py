"""How near is too near, by the definitions of the standards."""

# A near mid-air collision: 500 ft and 100 ft.
NMAC_HORIZONTAL_M, NMAC_VERTICAL_M = 152.4, 30.48
# Well clear for small UAS (ASTM F3442): 2000 ft and 250 ft.
WELL_CLEAR_HORIZONTAL_M, WELL_CLEAR_VERTICAL_M = 609.6, 76.2
