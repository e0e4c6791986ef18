"""Physical constants and radii, SI units, each with its source."""

# Geometry of light: a spherical Earth to sea level, vacuum above the top of the atmosphere.
EARTH_RADIUS = 6.371e6  # m, mean radius (IUGG R1)
EARTH_EQUATORIAL_RADIUS = 6.378137e6  # m (WGS 84), where a scene asks for the flattening
EARTH_POLAR_RADIUS = 6.356752314e6  # m (WGS 84)
ATMOSPHERE_TOP = 120e3  # m, refractivity there is below 1e-11
SUN_RADIUS = 6.957e8  # m, nominal (IAU 2015 resolution B3)
MOON_RADIUS = 1.7374e6  # m, mean (IAU WGCCRE 2009)
ASTRONOMICAL_UNIT = 1.495978707e11  # m (IAU 2012 resolution B2)
MOON_MEAN_DISTANCE = 3.844e8  # m

# Almanac convention for contact times: Danjon's shadow. Not used for light.
ALMANAC_EARTH_RADIUS = 6.378137e6  # m, equatorial (WGS 84)
ALMANAC_SUN_RADIUS = 6.96e8  # m
ALMANAC_MOON_RATIO = 0.2725076  # Moon's radius / Earth's equatorial radius (IAU 1982)
DANJON_ENLARGEMENT = 1.01  # of the Moon's parallax (Danjon 1951)

# U.S. Standard Atmosphere 1976, table 2 and section 1.2.
STANDARD_GRAVITY = 9.80665  # m s^-2
MOLAR_MASS_AIR = 28.9644e-3  # kg mol^-1
GAS_CONSTANT = 8.31432  # J mol^-1 K^-1: the standard's own value, not CODATA's
GEOPOTENTIAL_RADIUS = 6.356766e6  # m
STANDARD_TEMPERATURE = 288.15  # K, surface
STANDARD_PRESSURE = 101325.0  # Pa, surface
BOLTZMANN = 1.380622e-23  # J K^-1: again the standard's own

DOBSON_UNIT = 2.6867e20  # molecules m^-2
SPEED_OF_LIGHT = 2.99792458e8  # m s^-1
