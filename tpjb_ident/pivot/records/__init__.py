"""A dry load-deflection record made ready: holds found, averaged, projected on its pad, or refused."""
