"""The words of page and document, beside their tables and figures."""

RATIOS = (
    "Risk ratio: near mid-air collisions (NMAC: within 152.4 m and 30.48 m) with avoidance as a share of "
    "those without, in the same weighted encounters. Well clear ratio: the same for losses of well clear "
    "(609.6 m and 76.2 m). Unnecessary: share of the encounters that stay well clear without avoidance in "
    "which an avoidance is flown. Brackets: 95 % intervals (bootstrap over encounters; the rule of three "
    "where nothing happened)."
)

PARTS = (
    "Unresolved: there without avoidance and still there with it. Induced: only with avoidance. Both are "
    "counts of encounters, not weighted. Aside and height: the largest deviation from the mission, median "
    "over the encounters that lose well clear without avoidance."
)

CONVERGED = (
    "Half interval: half of the 95 % interval as a share of the estimate; within 5 % counts as converged. "
    "Moved: the largest distance of the running estimate from its last value within the last half of the "
    "encounters. Needs: encounters until the interval is that narrow, at this spread. A ratio without any "
    "event has no relative interval: its upper bound is in the results above."
)

NEES = (
    "NEES: the squared error of a track in units of the variance that it claims, divided by its two "
    "degrees of freedom (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and "
    "Navigation, 2001, 5.4.2), mean over encounters, once a second from the ninth report on. 1 is "
    "consistent; the interval is that of as many independent chi-square numbers. Above it a track is more "
    "certain of itself than it may be, below it more cautious than it need be. Shifted: against the truth "
    "as old as the reports, which leaves out a latency that receivers do not report."
)

SETS_DRAWN = (
    "Intruders are drawn from the models, and placed so that they pass uniformly within twice well clear, "
    "more often the faster they close. Half of the encounters are drawn from the core where collisions "
    "happen; the weights (real over sampled frequency) correct for it. Effective: equally weighted "
    "encounters of the same variance."
)

SETS_BUILT = (
    "Encounters built backwards from the closest approach, half of them hits, all of the same weight: no "
    "model of real traffic was given (--model). These figures show how the product behaves, not how "
    "often."
)

SETS_READ = (
    "Encounters read from files, all of the same weight. They repeat where more are flown than the files "
    "have, each time with other errors of the reports."
)

LIMITS = (
    "What this is not: flights of a simulated aircraft with the dynamics of recorded ones, by the same "
    "engine that flies the aircraft, without wind, terrain or failures of equipment. All presets report "
    "as ADS-B does, with a pressure altitude. Encounter models describe crewed traffic over the United "
    "States, also where the preset is that of an unmanned aircraft (remote-id). It is one part of a "
    "safety case."
)

EQUIPAGE = (
    "Errors of reports, one sigma of each axis; the bias of a height is drawn once for an intruder. Where "
    "a latency is unknown, the receiver reports none. Sources and assumptions of each preset stand in "
    "sim/encounters/presets.py."
)

PEERS = (
    "The peers fly in the same engine with the same tracks, and fewer encounters than the product. The row "
    '"as many" is the product in the encounters of the peers, which compares like with like.'
)

SWEEPS = (
    "One value of adsb-out or of the own aircraft is varied at a time, in the same encounters. The own "
    "range of airspeeds contains the speeds of the missions."
)

TWO_SIDED = (
    "The intruder flies its path as a mission, and the product too where both avoid: each hears the other "
    "by its reports only. Mirrored: both were displaced to the same side, of the encounters in which both "
    "avoided."
)

TRADE_OFF = (
    "An avoidance that begins later is flown less often without need, and loses well clear more often. "
    "The chosen values are those of the product; others are set in its configuration, section avoidance. "
    "Reports: adsb-out."
)

QUOTED = (
    "Pass lines are quoted, not taken from the documents themselves. 'Met': the whole 95 % intervals are "
    "within the line; 'not shown': the estimates are, the intervals are not."
)

WHOLE_CONFIGURATION = "The JSON file has the whole configuration, with the parameters of the traffic picture."

MIXED = (
    "Several versions flew these results, as the run was continued after a change: the figures mix them. "
    "The last section lists the versions. Use another folder for figures of one version."
)
