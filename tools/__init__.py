"""Programs for engineers, in the checkout: the wire's generated files and the documentation's pictures."""
