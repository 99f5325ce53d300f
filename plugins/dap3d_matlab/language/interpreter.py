"""Interprets the assignments of a MATLAB file; nothing else is executed."""

from typing import TYPE_CHECKING, Any

import attrs
import numpy as np

from dap3d_core.interface.formats import Place
from dap3d_core.scene import Mistake
from dap3d_matlab.language.expressions import Expressions, arguments_of, check_field, named_children
from dap3d_matlab.language.operators import RefusalError, ReportedError, numbers
from dap3d_matlab.language.parse import SourceFile, excerpt, text_of
from dap3d_matlab.language.values import (
    BROKEN,
    LARGEST_MATRIX,
    Broken,
    GivenValue,
    Struct,
    as_array,
    copied,
    kind_of,
)

if TYPE_CHECKING:
    from tree_sitter import Node

#: Maximal number of structures copied in arrays: a model has hundreds, a file of 1 MiB may need
#: billions.
MOST_COPIES = 1_000_000
#: Statements of one word without effect here.
IDLE_WORDS = ("include_global",)
#: Nodes without effect.
_IDLE = ("global_operator",)
_BLOCKS = {
    "for_statement": "a loop",
    "while_statement": "a loop",
    "if_statement": "a condition",
    "switch_statement": "a condition",
    "try_statement": "a block try",
    "class_definition": "a class",
}


@attrs.define
class Workspace:
    """The variables after the statements of a file.

    Attributes:
        variables: values by name; BROKEN where a mistake was reported.
        places: last assignments of whole variables.
        mistakes: mistakes in the file.
    """

    variables: dict[str, Any] = attrs.field(factory=dict)
    places: dict[str, Place] = attrs.field(factory=dict)
    mistakes: list[Mistake] = attrs.field(factory=list)


def follow(source: SourceFile, root: "Node") -> Workspace:
    """Interpret the statements of a valid MATLAB file.

    A statement outside the language is reported and has no effect; a variable that it might have
    changed becomes broken, so that one mistake is reported once.
    """
    interpreter = _Interpreter(source)
    interpreter.top(root)
    return interpreter.workspace


class _Interpreter:
    def __init__(self, source: SourceFile) -> None:
        self.source, self.workspace = source, Workspace()
        self.variables = self.workspace.variables
        self.expressions = Expressions(source, self.variables)
        self.copied = 0  # structures, in arrays that were assigned

    def top(self, root: "Node") -> None:
        """Interpret the statements of the file, or of its function."""
        statements = named_children(root)
        functions = [n for n in statements if n.type == "function_definition"]
        if functions and statements[0] is functions[0]:
            for other in functions[1:]:
                self._refuse(other, "a second function is outside the language that is read")
            blocks = [n for n in functions[0].children if n.type == "block"]
            statements = [n for block in blocks for n in named_children(block)]
            statements += [n for n in named_children(root) if n.type != "function_definition"]
        for statement in statements:
            if statement.type == "return_statement":
                break  # MATLAB stops here
            if self.copied > MOST_COPIES:
                words = f"more than {MOST_COPIES:,} structures are copied up to here"
                self._refuse(statement, f"{words}; what follows is not read")
                break
            self._statement(statement)
            if self.expressions.are_spent:
                break

    def _statement(self, node: "Node") -> None:
        try:
            if node.type == "assignment":
                self._assignment(node)
            elif node.type == "command":
                self._command(node)
            elif node.type in _BLOCKS or node.type == "function_definition":
                what = _BLOCKS.get(node.type, "a function within a file")
                words = f"{what} is outside the language that is read; nothing is run"
                raise RefusalError(node, words, "write the assignments out one by one")
            elif node.type not in _IDLE and text_of(node) not in IDLE_WORDS:
                self.expressions.value(node)
        except RefusalError as error:
            self._refuse(error.node, error.what, error.remedy, error.nearest)
            self._break(node)
        except ReportedError:
            self._break(node)

    def _command(self, node: "Node") -> None:
        words = [text_of(n) for n in node.children if n.type.startswith("command")]
        if words in [[w] for w in IDLE_WORDS]:
            return
        if len(words) > 2 and words[1] in (".", "=", "+=", "-=", "*=", "/="):
            what = "MATLAB reads this as a command, because of the spaces"
            raise RefusalError(node, what, "write it as an assignment: NAME.field = value")
        what = f"the command {words[0]} is outside the language that is read; nothing is run"
        raise RefusalError(node, what)

    def _refuse(self, node: "Node", what: str, remedy: str = "", nearest: str = "") -> None:
        self.workspace.mistakes.append(self.source.mistake(node, what, remedy, nearest))

    def _break(self, node: "Node") -> None:
        """Mark the variables that an ignored statement would have set as broken."""
        pending = [node]
        while pending:
            part = pending.pop()
            pending += [n for n in part.children if n.is_named]
            if part.type != "assignment":
                continue
            target = part.child_by_field_name("left")
            if target is not None and not self._break_field(target):
                while target.children and target.type != "multioutput_variable":
                    target = target.children[0]
                names = named_children(target) if target.children else [target]
                for name in names:
                    self.variables[text_of(name)] = BROKEN

    def _break_field(self, target: "Node") -> bool:
        """Mark one field of a structure as broken; True if the target is one."""
        if target.type != "field_expression":
            return False
        try:
            owner, field, _ = self.expressions.parts_of(target)
            struct = self._struct(owner)
        except (RefusalError, ReportedError):
            return False
        if field in struct.structure.known:
            struct.given[field] = GivenValue(BROKEN, self.source.place(target))
        return True

    # ---------------------------------------------------------------- assignments

    def _assignment(self, node: "Node") -> None:
        target, right = node.child_by_field_name("left"), node.child_by_field_name("right")
        operators = [n for n in node.children if not n.is_named]
        if target is None or right is None or [text_of(n) for n in operators] != ["="]:
            raise RefusalError(node, "this assignment is outside the language that is read")
        if target.type == "identifier":
            value = copied(self.expressions.value(right))
            self.copied += len(value) if isinstance(value, list) else 0
            if isinstance(value, Struct):
                value.variable, value.place = text_of(target), self.source.place(node)
            self.variables[text_of(target)] = value
            self.workspace.places[text_of(target)] = self.source.place(node)
        elif target.type == "field_expression":
            self._set_field(target, right)
        elif target.type == "function_call":
            self._set_element(target, right)
        else:
            raise RefusalError(node, f"{excerpt(target)} cannot be assigned to here")

    def _set_field(self, target: "Node", right: "Node") -> None:
        """``B1.r = ...``, ``Bodies(2).r(3) = ...``."""
        owner, field, arguments = self.expressions.parts_of(target)
        struct = self._struct(owner)
        check_field(target, struct, field)
        value = copied(self.expressions.value(right))
        if isinstance(value, (Struct, list)):
            raise RefusalError(right, f"a field holds no {kind_of(value)}")
        if arguments is not None:
            matrix = numbers(copied(struct.value(field)), target)
            matrix[self.expressions.at(target, matrix, arguments)] = self._single(value, right)
            value = matrix
        struct.given[field] = GivenValue(value, self.source.place(target))

    def _struct(self, owner: "Node") -> Struct:
        """The structure of a field, to be changed in place."""
        name = text_of(owner)
        if owner.type == "identifier" and name not in self.variables:
            what = f"{name} is not defined yet"
            raise RefusalError(owner, what, f"begin with {name} = Body_struct; or its like")
        value = self.expressions.value(owner)
        if isinstance(value, list) and len(value) == 1:
            value = value[0]
        if isinstance(value, Broken):
            raise ReportedError
        if not isinstance(value, Struct):
            raise RefusalError(owner, f"{excerpt(owner)} is {kind_of(value)}, which has no fields")
        return value

    def _set_element(self, target: "Node", right: "Node") -> None:
        """``Bodies(2) = B2``, ``x(3) = 1``; an array of structures grows by one at its end."""
        name_node = target.child_by_field_name("name")
        if name_node is None or name_node.type != "identifier":
            raise RefusalError(target, "this cannot be assigned to here")
        name, arguments = text_of(name_node), arguments_of(target)
        value = copied(self.expressions.value(right))
        array = self.variables.get(name, np.zeros((0, 0)))
        if isinstance(array, Broken):
            raise ReportedError
        if isinstance(value, Struct):
            self._set_struct(target, name, array, arguments, value)
            return
        if name not in self.variables:
            raise RefusalError(target, f"{name} is not defined yet", f"write {name} = [...];")
        matrix = numbers(array, target)
        matrix[self.expressions.at(target, matrix, arguments)] = self._single(value, right)

    def _set_struct(
        self, target: "Node", name: str, array: Any, arguments: list["Node"], value: Struct
    ) -> None:
        array = as_array(array)
        if not isinstance(array, list):
            raise RefusalError(target, f"{name} is {kind_of(array)}, no array of structures")
        kinds = {v.structure.kind for v in array if isinstance(v, Struct)}
        if kinds - {value.structure.kind}:
            raise RefusalError(target, f"{name} is an array of {kinds.pop()}_struct")
        (k,) = self.expressions.indices(target, arguments, (len(array),), room=1)
        if k >= LARGEST_MATRIX:
            raise RefusalError(target, f"an array of {k + 1} structures is no part of a model")
        if value.variable not in self.variables:
            value.variable, value.place = f"{name}({k + 1})", self.source.place(target)
        if k == len(array):
            array.append(value)
        else:
            array[k] = value
        self.variables[name] = array

    def _single(self, value: Any, node: "Node") -> float:
        number = numbers(value, node)
        if number.size != 1:
            raise RefusalError(node, f"one number is needed here, not {kind_of(value)}")
        return float(number[0, 0])
