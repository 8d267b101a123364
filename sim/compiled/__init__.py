"""What is compiled of the simulation: an aircraft that flies on, in Cython (`wing.pyx`).

An encounter of a campaign is more than a thousand steps of a tenth of a second. After a change `make setup`
builds it anew.
"""
