"""Elements and attributes of MJCF, and what becomes of them."""

from dap3d_formats.element_table import (
    REFUSED,
    TAKEN,
    Table,
    Word,
    moves,
    noted,
    refused,
    taken,
    translated,
)

_SOLVER = "settings of a solver"
_CONTACT = "contact properties; bodies do not touch each other"
_DRAWING = "drawing"
_SOFT = "softness of limits and equalities"
_LAW = "the law of an actuator; one that is linear within bounds is taken"
_FRAME = taken("pos quat axisangle xyaxes zaxis euler")
_ACTUATOR = (
    taken(
        "name class joint jointinparent tendon site gear kp kv gaintype gainprm biastype biasprm "
        "dyntype dynprm timeconst group ctrllimited forcelimited actlimited ctrlrange forcerange "
        "actrange inheritrange area diameter bias lengthrange range force scale lmin lmax vmax "
        "fpmax fvmax tausmooth"
    )
    | translated("dampratio", "damping, by the mass matrix where the model starts")
    | noted("user actdim", _DRAWING)
    | moves("refsite cranksite slidersite cranklength body", _LAW)
    | moves(
        "actearly plugin kd gain vmin input nsample interp delay armature damping ffrange velrange "
        "cogging controller inductance lugre motorconst nominal resistance saturation thermal imax "
        "ki posrange slewmax",
        _LAW,
    )
)
_EQUALITY = taken("name class active") | translated("solref solimp", "the equality holds exactly")

_TENDON = (
    taken("name class limited range stiffness damping springlength armature")
    | noted("group width material rgba user", _DRAWING)
    | moves("solreflimit solimplimit solreffriction solimpfriction margin", _SOFT)
    | moves("frictionloss actuatorfrclimited actuatorfrcrange springyield",
            "friction and bounds of tendons")
)  # fmt: skip

MJCF: Table = {
    "mujoco": taken("model"),
    "mujocoinclude": taken(),
    "include": taken("file"),
    "compiler": taken(
        "angle eulerseq autolimits inertiafromgeom inertiagrouprange meshdir assetdir strippath "
        "boundmass boundinertia balanceinertia settotalmass coordinate"
    )
    | noted("texturedir discardvisual fusestatic convexhull fitaabb usethread", "no effect here")
    | noted(
        "alignfree saveinertial exactmeshinertia conflict passthrough savecanonical savecompiled",
        "no effect here",
    ),
    "lengthrange": noted("", "muscles"),
    "option": taken("gravity actuatorgroupdisable")
    | moves("wind density viscosity magnetic", "fluids and fields")
    | noted(
        "timestep impratio tolerance ls_tolerance noslip_tolerance ccd_tolerance sleep_tolerance "
        "o_margin o_solref o_solimp o_friction integrator cone jacobian solver iterations "
        "ls_iterations noslip_iterations ccd_iterations sdf_iterations sdf_initpoints "
        "apirate mpr_iterations mpr_tolerance collision",
        _SOLVER,
    ),
    "flag": taken("gravity constraint equality frictionloss limit contact clampctrl")
    | noted(
        "warmstart refsafe sensor midphase eulerdamp autoreset nativeccd island energy fwdinv "
        "invdiscrete multiccd sleep diagexact ipc speculative",
        _SOLVER,
    )
    | moves("passive spring damper filterparent actuation override", "what a solver leaves out"),
    "size": noted("", "memory of a simulator"),
    "visual": noted("", _DRAWING),
    "statistic": noted("", _DRAWING),
    "default": taken("class"),
    "custom": noted("", "data of a user"),
    "extension": noted("", "plugins of a simulator are not run"),
    "asset": taken(),
    "mesh": taken("name class file scale refpos refquat inertia")
    | translated("vertex face", "its mass properties count; it is not drawn")
    | noted("normal texcoord builtin params", "meshes without a file are not drawn")
    | noted("content_type smoothnormal maxhullvert material octree_maxdepth", _DRAWING),
    "material": taken("name class rgba")
    | noted(
        "texture texrepeat texuniform emission specular shininess reflectance metallic roughness",
        "textures are not drawn",
    ),
    "layer": noted("", "textures are not drawn"),
    "texture": noted("", "textures are not drawn"),
    "hfield": taken("name file nrow ncol size elevation")
    | noted("content_type", _DRAWING),
    "skin": noted("", "skins are not drawn"),
    "model": taken("name file") | noted("content_type", "it is MJCF"),
    "worldbody": taken(),
    "body": _FRAME | taken("name childclass")
    | translated("mocap", "a part of ground, at its pose or that of the keyframe")
    | taken("gravcomp")
    | noted("user sleep fuse simple", "data of a simulator"),
    "frame": _FRAME | taken("name childclass"),
    "inertial": _FRAME | taken("mass diaginertia fullinertia"),
    "joint": taken(
        "name class type pos axis range limited ref springref stiffness damping armature "
        "actuatorfrcrange actuatorfrclimited"
    )
    | translated("frictionloss", "it sticks; with method joint it fades at low rates")
    | translated("springdamper", "stiffness and damping, by the mass matrix where the model starts")
    | moves("springyield", "springs do not yield")
    | moves("solreflimit solimplimit solreffriction solimpfriction margin", _SOFT)
    | translated("actuatorgravcomp", "gravcomp is no part of what actuatorfrcrange bounds")
    | noted("group user align", _DRAWING),
    "freejoint": taken("name") | noted("group align", _DRAWING),
    "geom": _FRAME
    | taken("name class type size fromto mesh mass density group rgba material")
    | taken("hfield") | noted("shellinertia fitscale", "not drawn")
    | moves("fluidshape fluidcoef", "fluids")
    | taken("contype=0 conaffinity=0", "no contact, as everywhere in dap3d")
    | moves(
        "contype conaffinity condim priority friction solmix solref solimp margin gap", _CONTACT
    )
    | noted("user castshadow", _DRAWING)
    | moves("adhesion surfacevel", _CONTACT),
    "site": _FRAME | taken("name class fromto")
    | noted("type size group material rgba user mesh", _DRAWING),
    "camera": noted("", _DRAWING),
    "light": noted("", _DRAWING),
    "plugin": noted("", "plugins of a simulator are not run"),
    "composite": refused("", "composites are not expanded; save the compiled model in MuJoCo"),
    "flexcomp": refused("", "deformable bodies"),
    "replicate": taken("count sep offset euler"),
    "attach": taken("model body frame prefix"),
    "deformable": moves("", "deformable bodies"),
    "contact": moves("", _CONTACT),
    "pair": moves("", _CONTACT),
    "equality": _EQUALITY,
    "connect": _EQUALITY | taken("body1 body2 anchor site1 site2"),
    "weld": _EQUALITY | taken("body1 body2 relpose anchor site1 site2")
    | moves("torquescale", _SOFT),
    "equality/joint": _EQUALITY | taken("joint1 joint2 polycoef"),
    "equality/tendon": _EQUALITY | taken("tendon1 tendon2 polycoef"),
    "flex": moves("", "deformable bodies"),
    "flexstrain": noted("", "deformable bodies"),
    "flexvert": noted("", "deformable bodies"),
    "distance": moves("", "distances"),
    "tendon": taken(),
    "default/tendon": taken() | moves(
        "frictionloss actuatorfrclimited actuatorfrcrange springyield margin "
        "solreflimit solimplimit solreffriction solimpfriction", "of tendons",
    ) | taken("class limited range stiffness damping springlength armature group width material "
              "rgba user"),
    "fixed": _TENDON,
    "fixed/joint": taken("joint coef"),
    "spatial": _TENDON,
    "spatial/site": taken("site"),
    "spatial/geom": taken("geom sidesite"), "pulley": taken("divisor"),
    "actuator": taken(),
    **dict.fromkeys(
        ("motor", "general", "position", "velocity", "intvelocity", "cylinder", "muscle"),
        _ACTUATOR,
    ),
    **dict.fromkeys(
        ("damper", "adhesion", "dcmotor", "orientation", "pid"),
        moves("", _LAW) | _ACTUATOR,
    ),
    "actuator/plugin": moves("", "plugins of a simulator are not run"),
    "body/plugin": moves("", "plugins of a simulator are not run"),
    "sensor": noted("", "sensors"),
    "keyframe": taken(),
    "key": translated("", "where the scene starts, with --key")
    | taken("name qpos qvel act ctrl mpos mquat") | noted("time plastic", "runs start at 0"),
}  # fmt: skip

#: Where shapes are to meet each other.
CONTACTS: Table = {
    **MJCF,
    "geom": dict(MJCF["geom"]) | taken("contype conaffinity friction priority")
    | taken("condim")
    | moves("solmix solref solimp margin gap", "contacts are rigid"),
    "contact": taken(),
    "exclude": taken("name body1 body2"),
    "pair": taken("name class geom1 geom2 condim friction")
    | moves("solref solimp solreffriction margin gap", "contacts are rigid"),
}  # fmt: skip


def further(parent: str, name: str) -> Word:
    """What becomes of an element that its parent has another of before."""
    once = name == "inertial" or (parent == "default" and name != "default")
    return (REFUSED, "MuJoCo takes one") if once else (TAKEN, "")
