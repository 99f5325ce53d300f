"""What is fuzzed: for each target how its inputs are made, and what must be true of them."""

from collections.abc import Callable

import attrs
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis.strategies import SearchStrategy

from fuzz.acceptable import check_any_scene, check_good_scene
from fuzz.contacts import check_contacts
from fuzz.contacts import numbers as numbers_of_contacts
from fuzz.damage import damaged_scenes
from fuzz.expressions import check_expression, expressions
from fuzz.gradients import check_gradients
from fuzz.gradients import numbers as numbers_of_gradients
from fuzz.instants import check_instants
from fuzz.instants import numbers as numbers_of_instants
from fuzz.matlab import check_model, damaged_models
from fuzz.models import check_model_file, damaged_model_files
from fuzz.numbers import changes, check_change
from fuzz.programs import check_program, sources
from fuzz.results import check_result, damaged_results
from fuzz.scenes import scenes
from fuzz.words import check_command, check_quantity, command_lines, quantity_names


@attrs.frozen
class Target:
    """Something that takes input from outside.

    Attributes:
        name: on the command line.
        inputs: makes inputs, bytes each.
        check: raises where one is not dealt with as it should be; returns how it ended, in words.
        ending: of files that hold an input.
    """

    name: str
    inputs: SearchStrategy[bytes]
    check: Callable[[bytes], str]
    ending: str

    def run(self, number: int, count: int, *, derandomize: bool = False, before=None) -> None:
        """Check some inputs; the first that fails raises.

        Args:
            number: of the sequence of inputs, which is the same for the same number.
            count: how many.
            derandomize: as hypothesis has it; the number is not used then.
            before: called with each input before it is checked, and with how it ended after.
        """

        def one(data):
            if before is not None:
                before(data, None)
            words = self.check(data)
            if before is not None:
                before(data, words)

        phases = [Phase.generate] if not derandomize else [Phase.generate, Phase.shrink]
        asked = settings(
            max_examples=count, phases=phases, derandomize=derandomize,
            database=None, deadline=None,
            suppress_health_check=list(HealthCheck), print_blob=False,
        )  # fmt: skip
        test = asked(given(self.inputs)(one))
        (test if derandomize else seed(number)(test))()


TARGETS = {
    target.name: target
    for target in (
        Target("scenes", scenes().map(str.encode), check_good_scene, ".toml"),
        Target("damaged", damaged_scenes(), check_any_scene, ".toml"),
        Target("matlab", damaged_models(), check_model, ".json"),
        Target("models", damaged_model_files(), check_model_file, ".txt"),
        Target("results", damaged_results(), check_result, ".nc"),
        Target("numbers", changes(), check_change, ".json"),
        Target("quantities", quantity_names(), check_quantity, ".txt"),
        Target("expressions", expressions(), check_expression, ".txt"),
        Target("commands", command_lines(), check_command, ".json"),
        Target("programs", sources(), check_program, ".py"),
        Target("contacts", numbers_of_contacts(), check_contacts, ".txt"),
        Target("gradients", numbers_of_gradients(), check_gradients, ".txt"),
        Target("instants", numbers_of_instants(), check_instants, ".txt"),
    )
}
