"""How well a network knows a dance: figures, reports and pictures."""
