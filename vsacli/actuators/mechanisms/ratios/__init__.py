"""Mechanisms whose motor 2 changes a ratio: U = K(s) w(phi), and the torque K(s) g(phi) with g = w'."""
