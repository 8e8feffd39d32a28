"""What the programs run_*.py share: python run_TOOL.py CASE RESULT, both JSON.

CASE:   fmus         name -> path of the FMU
        connections  [from FMU, output, to FMU, input]
        inputs       FMU -> input -> its value in every step
        outputs      FMU -> names
        step, steps  communication step, s, and their number
RESULT: FMU -> one row of outputs at the end of every step. Numbers are written so that they read back to the same bits.
"""

import json
import sys


def main(simulate):
    with open(sys.argv[1]) as file:
        case = json.load(file)
    result = simulate(case)
    with open(sys.argv[2], "w") as file:
        json.dump(result, file)
