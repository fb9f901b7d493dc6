"""Trim, linearise and fly an aircraft in JSBSim: one manoeuvre, a replay of a record, or a campaign."""
