"""A scene in the words, and units, of its files: dataclasses without MuJoCo."""

from .environment import Actuator as Actuator
from .environment import BaseKind as BaseKind
from .environment import Body as Body
from .environment import Boundary as Boundary
from .environment import BoundaryShape as BoundaryShape
from .environment import Comment as Comment
from .environment import Connection as Connection
from .environment import DHForm as DHForm
from .environment import DHParameters as DHParameters
from .environment import Dialect as Dialect
from .environment import Environment as Environment
from .environment import JointLimits as JointLimits
from .environment import JointType as JointType
from .environment import MultiBody as MultiBody
from .environment import MultiBodyKind as MultiBodyKind
from .environment import PlannerRules as PlannerRules
from .environment import Pose as Pose
from .environment import Recentring as Recentring
from .environment import Resolution as Resolution
from .environment import SMAShape as SMAShape
from .environment import Task as Task
from .environment import VelocityBounds as VelocityBounds
