"""Functions of one argument that rate laws have no operation for, written by the operations that they have.

Their values are those of the operations: where a function is near 0, a difference of larger terms leaves it an absolute
error of some 1e-16.
"""

SINH, COSH = "((exp(x) - exp(-x)) / 2)", "((exp(x) + exp(-x)) / 2)"
TANH = "(1 - 2 / (exp(2 * x) + 1))"  # 1 and -1 if the exponential is beyond all floats
SIGN = "piecewise(1, 0 < x, -1, x < 0, 0)"

MADE_OF_OTHERS = {
    "tan": "sin(x) / cos(x)",
    "cot": "cos(x) / sin(x)",
    "sec": "1 / cos(x)",
    "csc": "1 / sin(x)",
    "sinh": SINH,
    "cosh": COSH,
    "tanh": TANH,
    "coth": f"1 / {TANH}",
    "sech": f"1 / {COSH}",
    "csch": f"1 / {SINH}",
    "asinh": f"{SIGN} * log(abs(x) + sqrt(x * x + 1))",  # without |x| the two terms would cancel below 0
    "acosh": "log(x + sqrt(x * x - 1))",
    "atanh": "log((1 + x) / (1 - x)) / 2",
    "sign": SIGN,
}
