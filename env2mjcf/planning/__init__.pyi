from .plan_tasks import plan as plan
from .plan_tasks import plan_through as plan_through
from .planners import PLANNERS as PLANNERS
from .result import Plan as Plan
