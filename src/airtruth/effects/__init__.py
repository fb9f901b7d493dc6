"""Effects: what a declared model may lack, described once, and flown, traced and written from that."""
