"""Array types of the package's annotations: double precision throughout."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int_]
BoolArray = NDArray[np.bool_]
