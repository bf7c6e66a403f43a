"""A spring behind a cam, compressed by the cam's lift and by motor 2: U = k/2 (l(phi) + p)^2."""
