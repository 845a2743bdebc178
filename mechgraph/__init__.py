"""mechgraph: kinematics, kinetostatics and dynamics of spatial mechanisms."""

import sys
from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING, Any

from mechgraph import errors  # noqa: F401  # isort: skip  # before all that takes time to load
import mechgraph.kinematics  # noqa: F401  # see below
from mechgraph import methods
from mechgraph.errors import (
    AssemblyError,
    ContentError,
    DeadPointError,
    DeclarationError,
    FileError,
    FrictionError,
    IndeterminateError,
    MechgraphError,
    MechgraphWarning,
    MissingExtraError,
    ReachError,
    ResponseError,
    ShapeError,
    StudyError,
)
from mechgraph.exchange.files import load, save
from mechgraph.fields import Formatted
from mechgraph.maths import inertia
from mechgraph.maths.tolerances import Tolerances
from mechgraph.memo import once_written
from mechgraph.model import parts
from mechgraph.model.belts import BeltDrive
from mechgraph.model.couplings import Coupling
from mechgraph.model.friction import Friction
from mechgraph.model.gears import BevelGear, Gear, GearRack, Pulley, Worm, WormWheel, planet_places
from mechgraph.model.loads import Damper, Effort, ForceLaw, ForceTable, Gravity, Spring, TorsionSpring, Wrench
from mechgraph.model.mechanism import Mechanism, chain
from mechgraph.model.meshes import Mesh
from mechgraph.model.motion import Drive, Motion
from mechgraph.model.pair import Link, Marker, Misfit, Pair, Stiffness
from mechgraph.model.setups import Event, ResponseSetup, Stop, SynthesisSetup
from mechgraph.model.short_forms import Belt, BevelGears, Rack, SpurGears, WormGear
from mechgraph.model.toml import library_names as library
from mechgraph.pairs.cam_laws import CamLaw, Segment, cam_laws
from mechgraph.pairs.contact_types import Hertz
from mechgraph.pairs.curves import Curve
from mechgraph.pairs.factors import Bookkeeping, Component, Freedom
from mechgraph.pairs.journal import Journal
from mechgraph.pairs.pair_type import PairType, pair_types
from mechgraph.pairs.surfaces import Surface
from mechgraph.quantities import with_clear_calls

if TYPE_CHECKING:
    from mechgraph.compiled.compiled import Compiled, compile
    from mechgraph.determinacy.decomposition import Decomposition, Group
    from mechgraph.determinacy.equivalent import multiple_joints, split_joint
    from mechgraph.determinacy.families import Families
    from mechgraph.determinacy.report import DeterminacyReport, Structure, check, groups, structure
    from mechgraph.equations.build import formulate
    from mechgraph.equations.formulation import Formulation
    from mechgraph.graph.atlas import (
        Identity,
        MultipleJoint,
        SystemGroup,
        atlas,
        identify,
        load_chains,
        save_chains,
        system_groups,
    )
    from mechgraph.graph.chains import Chain
    from mechgraph.kinetostatics import Transmission, assemble, kinematics, least_preload, solve, transmission
    from mechgraph.model.gear_facts import mesh_facts
    from mechgraph.modes.assemblies import Assemblies, AssembliesOver, assemblies
    from mechgraph.modes.branches import Branches, branches
    from mechgraph.pairs.cams import least_base_radius
    from mechgraph.response.equilibrium import equilibrium, linearize
    from mechgraph.response.respond import Response, respond
    from mechgraph.result.free_body import FreeBody, free_body
    from mechgraph.result.over_time import OverTime, over_time
    from mechgraph.result.solution import Solution
    from mechgraph.show.page.write import write_report
    from mechgraph.synthesis.answers import Syntheses, SynthesesOver
    from mechgraph.synthesis.syntheses import synthesize
    from mechgraph.synthesis.tasks import function, path, poses, positions
    from mechgraph.variants.study import Study, study

__all__ = [
    "Assemblies", "AssembliesOver", "AssemblyError", "Belt", "BeltDrive", "BevelGear", "BevelGears", "Bookkeeping",
    "Branches", "CamLaw", "Chain", "Compiled", "Component", "ContentError", "Coupling", "Curve", "Damper",
    "DeadPointError", "DeclarationError", "Decomposition", "DeterminacyReport", "Drive", "Effort", "Event", "Families",
    "FileError", "ForceLaw", "ForceTable", "Formulation", "FreeBody", "Freedom", "Friction", "FrictionError", "Gear",
    "GearRack", "Gravity", "Group", "Hertz", "Identity", "IndeterminateError", "Journal", "Link", "Marker",
    "Mechanism", "MechgraphError", "MechgraphWarning", "Mesh", "Misfit", "MissingExtraError", "Motion",
    "MultipleJoint", "OverTime", "Pair", "PairType", "Pulley", "Rack", "ReachError", "Response", "ResponseError",
    "ResponseSetup", "Segment", "ShapeError", "Solution", "Spring", "SpurGears", "Stiffness", "Stop", "Structure",
    "Study", "StudyError", "Surface", "Syntheses", "SynthesesOver", "SynthesisSetup", "SystemGroup", "Tolerances",
    "TorsionSpring", "Transmission", "Worm", "WormGear", "WormWheel", "Wrench", "assemble", "assemblies", "atlas", "branches",
    "cam_laws", "chain", "check", "compile", "equilibrium", "formulate", "free_body", "function", "groups", "identify",
    "inertia", "kinematics", "least_base_radius", "least_preload", "library", "linearize", "load", "load_chains",
    "mesh_facts", "multiple_joints", "over_time", "pair_types", "parts", "path", "planet_places", "poses", "positions",
    "respond", "save", "save_chains", "solve", "split_joint", "structure", "study", "synthesize", "system_groups",
    "transmission", "write_report",
]  # fmt: skip


def _with_subclasses(kind: type[Any]) -> Iterator[type[Any]]:
    yield kind
    for one in kind.__subclasses__():
        yield from _with_subclasses(one)


for _declared in (*_with_subclasses(Formatted), Tolerances, PairType, Freedom, Component, Bookkeeping):
    once_written(_declared, with_clear_calls)


globals().pop("kinematics")  # a room and a function have this name; a user means the function, which __getattr__ finds


def __dir__() -> list[str]:
    """The public names."""
    return sorted(__all__)


def __getattr__(name: str) -> Any:
    """What only some scripts need is loaded where it is first asked for (PEP 562)."""
    home: Any
    match name:
        case "__version__":
            from importlib.metadata import PackageNotFoundError, version

            try:
                return version("mechgraph")
            except PackageNotFoundError:
                return "(not installed)"
        case "Compiled" | "compile":
            from mechgraph.compiled import compiled as home
        case "Decomposition" | "Group":
            from mechgraph.determinacy import decomposition as home
        case "equivalent" | "multiple_joints" | "split_joint" | "to_planar" | "to_spatial":
            from mechgraph.determinacy import equivalent as home
        case "Families":
            from mechgraph.determinacy import families as home
        case "DeterminacyReport" | "Structure" | "check" | "groups" | "structure":
            from mechgraph.determinacy import report as home
        case "snapped":
            from mechgraph.determinacy import snapping as home
        case "formulate":
            from mechgraph.equations import build as home
        case "Formulation":
            from mechgraph.equations import formulation as home
        case "write_curve":
            from mechgraph.exchange import curve_files as home
        case (
            "Identity"
            | "MultipleJoint"
            | "SystemGroup"
            | "atlas"
            | "identify"
            | "load_chains"
            | "save_chains"
            | "system_groups"
        ):
            from mechgraph.graph import atlas as home
        case "Assemblies" | "AssembliesOver" | "assemblies":
            from mechgraph.modes import assemblies as home
        case "Branches" | "branches":
            from mechgraph.modes import branches as home
        case "equilibrium" | "linearize":
            from mechgraph.response import equilibrium as home
        case "Response" | "respond":
            from mechgraph.response import respond as home
        case "FreeBody" | "free_body":
            from mechgraph.result import free_body as home
        case "OverTime" | "film_of" | "over_time":
            from mechgraph.result import over_time as home
        case "draw_branches" | "draw_points" | "draw_side_by_side":
            from mechgraph.show import diagrams as home
        case "view" | "write_report":
            from mechgraph.show.page import write as home
        case "Syntheses" | "SynthesesOver":
            from mechgraph.synthesis import answers as home
        case "synthesize":
            from mechgraph.synthesis import syntheses as home
        case "function" | "path" | "poses" | "positions":
            from mechgraph.synthesis import tasks as home
        case "Study" | "study":
            from mechgraph.variants import study as home
        case "Chain":
            from mechgraph.graph import chains as home
        case "Transmission" | "assemble" | "kinematics" | "least_preload" | "solve" | "transmission":
            from mechgraph import kinetostatics as home
        case "mesh_facts":
            from mechgraph.model import gear_facts as home
        case "least_base_radius":
            from mechgraph.pairs import cams as home
        case "Solution":
            from mechgraph.result import solution as home
        case "cutter_path":
            from mechgraph.pairs import travelling as home
        case _:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}", name=name, obj=sys.modules[__name__])
    return globals().setdefault(name, getattr(home, name))


methods.HOMES.append(partial(getattr, sys.modules[__name__]))
