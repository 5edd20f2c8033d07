from .assertions import PICTURES_VARIABLE as PICTURES_VARIABLE
from .assertions import assert_free as assert_free
from .assertions import assert_valid as assert_valid
from .assertions import assert_valid_path as assert_valid_path
