"""Fly: trim, linearise and fly an aircraft in JSBSim, one manoeuvre or a campaign of them."""
