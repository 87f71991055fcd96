"""Reference solutions, exact or computed independently of the flow scheme; any units."""
