"""The parametrized planning problem and plan: data model, readers, writers, parametrization and a concrete simulator.

Files become a :class:`robust.plan.model.ParametrizedPlan` by :func:`robust.load_plan`.
"""
