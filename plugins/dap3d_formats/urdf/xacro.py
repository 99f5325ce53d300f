"""Macros of xacro, expanded by the library xacrodoc where the user allows it."""

from dap3d_core.interface.formats import FormatError, Source, XmlElement, parse_xml


def expanded(source: Source, root: XmlElement) -> XmlElement:
    """The root of the file without macros.

    Raises:
        FormatError: it is not allowed, the library is not installed, or the macros are wrong.
    """
    if not source.allow_code:
        what = "is a xacro file, whose expressions are code in Python; it is not evaluated"
        raise FormatError(what, root.place, "--allow-code evaluates it, if you trust its author")
    try:
        from xacrodoc import XacroDoc, packages
    except ImportError:
        what = "xacro files are read with xacrodoc: pip install 'dap3d[xacro]'"
        raise FormatError(what, root.place) from None
    try:
        packages.update_package_cache({k: str(v) for k, v in source.packages.items()})
        document = XacroDoc.from_file(str(source.path), resolve_packages=False)
        text = document.to_urdf_string()
    except BaseException as error:  # code of the file: it may raise anything
        if isinstance(error, KeyboardInterrupt):
            raise
        what = f"xacro cannot expand it: {type(error).__name__}: {error}"
        raise FormatError(what, root.place) from None
    return parse_xml(text, f"{source.path.name} (expanded)")
