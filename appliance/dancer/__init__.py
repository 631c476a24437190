"""The dancer: motion sources, puppeteers, the puppet and its blending."""
