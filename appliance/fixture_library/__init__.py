"""`bunraku lights convert`: fixtures of the Open Fixture Library become profiles, before any show runs."""
