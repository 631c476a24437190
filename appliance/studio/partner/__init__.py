"""A partner: what couples of recordings teach about answering another dancer."""
