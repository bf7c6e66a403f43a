"""Independent routes to the numbers that vsacli computes; none of them calls what it judges."""
