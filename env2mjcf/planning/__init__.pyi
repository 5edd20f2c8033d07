from .planners import PLANNERS as PLANNERS
from .result import Plan as Plan
from .result import Progress as Progress
from .route import plan as plan
from .route import plan_through as plan_through
