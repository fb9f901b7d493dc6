"""The lateral-directional motion: its equations as regressions over (coefficient, signal), and its predictor."""
