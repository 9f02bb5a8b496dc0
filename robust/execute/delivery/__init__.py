"""Robot delivery: the domain of the papers' execution experiments, and generators of problems and plans [IRR §5]."""

from robust.execute.delivery.domain import PREPARATIONS, TASKS, DeliveryVariant, delivery_domain
from robust.execute.delivery.problem import DeliveryOptions, Order, delivery_problem
from robust.execute.delivery.scaling import ScalingInstance, scaling_instance
from robust.execute.delivery.table import TableProblem, table_problems

__all__ = [
    "PREPARATIONS",
    "TASKS",
    "DeliveryOptions",
    "DeliveryVariant",
    "Order",
    "ScalingInstance",
    "TableProblem",
    "delivery_domain",
    "delivery_problem",
    "scaling_instance",
    "table_problems",
]
