"""One module for each family of formats that are written; `etnet.events.write` chooses."""
