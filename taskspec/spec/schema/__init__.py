"""The shape of a spec, before any expression is read: the one package that imports pydantic."""

from __future__ import annotations

from taskspec.spec.schema.check import check_shape as check_shape
from taskspec.spec.schema.check import validated as validated
from taskspec.spec.schema.export import json_schema as json_schema
from taskspec.spec.schema.models import Abstraction as Abstraction
from taskspec.spec.schema.models import Claim as Claim
from taskspec.spec.schema.models import Component as Component
from taskspec.spec.schema.models import Erratum as Erratum
from taskspec.spec.schema.models import Figure as Figure
from taskspec.spec.schema.models import Parameter as Parameter
from taskspec.spec.schema.models import Parameters as Parameters
from taskspec.spec.schema.models import Requirement as Requirement
from taskspec.spec.schema.models import Roles as Roles
from taskspec.spec.schema.models import Source as Source
from taskspec.spec.schema.variants import Spec as Spec
