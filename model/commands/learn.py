"""`matphys fit`, `validate`, `test`, `predict`: handed on to Lightning's command line."""

import click

_ANY = {"ignore_unknown_options": True, "help_option_names": []}


def _handed_on(name: str, does: str) -> click.Command:
    @click.command(name, context_settings=_ANY, help=f"{does} Options: `matphys {name} --help`.")
    @click.argument("arguments", nargs=-1, type=click.UNPROCESSED)
    def command(arguments: tuple[str, ...]) -> None:
        from model.predictor.main import run

        run([name, *arguments])

    return command


fit = _handed_on("fit", "Train a predictor on cases (--config configs/default.yaml).")
validate = _handed_on("validate", "Measure a checkpoint on the validation cases.")
test = _handed_on("test", "Measure a checkpoint on the test cases.")
predict = _handed_on("predict", "Write the parameters that a checkpoint predicts, per case.")
COMMANDS = (fit, validate, test, predict)
