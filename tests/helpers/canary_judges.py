"""What BioNetGen and Antimony make of a text: after their sources, by line or by character, without code of ours."""

import re


def bionetgen_lines(text):
    """The lines of a file as its get_line makes them, which stops at the line 0."""
    rest = text.encode().decode("latin-1").split("\n")
    while rest:
        line = re.sub("#.*$", "", rest.pop(0))
        if not re.search(r"\S", line, re.ASCII):
            continue
        while re.search(r"\\\s*$", line, re.ASCII):
            line = re.sub(r"\\\s*$", "", line, flags=re.ASCII)
            if not rest:
                break
            line += re.sub("#.*$", "", rest.pop(0))
        if line == "0":
            return
        yield line


def evaluated(text, skips_actions):
    """What BioNetGen's readFile hands to Perl's eval."""
    lines, found = bionetgen_lines(text), []
    for whole in lines:
        line = re.sub(r"^\s+", "", whole, flags=re.ASCII)
        action = re.search(r"^\s*(\w+)\s*\((.*)\);?\s*$", line, re.ASCII)
        if re.search(r"^(begin|end)\s+model\s*$", line, re.ASCII):
            continue
        if line.startswith("begin"):
            name = re.sub(r"\s+", " ", line[5:].strip())
            for inner in lines:
                if re.search(r"^\s*end\s+", inner, re.ASCII):
                    if re.sub(r"\s+", " ", re.sub(r"^\s*end\s+", "", inner).rstrip()) != name:
                        return found
                    break
                if re.search(r"^\s*begin", inner, re.ASCII):
                    return found
                called = re.search(r"^(?:\d+\s+)?\s*(\w+)\s*\((.*)\);?\s*$", inner, re.ASCII)
                if name == "actions" and not skips_actions and called:
                    found.append(f"{called[1]}({called[2]})".replace('"', "'"))
        elif re.search(r"^\s*(setOption)\s*\((.*)\);?\s*$", line, re.ASCII):
            found.append(line)
        elif re.search(r"^\s*(parameter|param|par)\s+", line, re.ASCII | re.IGNORECASE):
            continue
        elif action and not skips_actions:
            found.append(f"{action[1]}({action[2]})".replace('"', "'"))
    return found


VALUE = r"(?:-?[0-9.]+(?:e[-+]?[0-9]+)?|'[^'\"\\$@`]*'|\"[^'\"\\$@`]*\"|\{(?:'\w+'=>[0-9.e+-]+,?)*\})"
CONSTANT = re.compile(
    rf"(?:setOption|setParameter|setConcentration|addConcentration|setVolume|(?:save|reset)(?:Parameters|Concentrations))"
    rf"\((?:{VALUE}(?:,{VALUE})*)?\);?|generate_network\(\{{overwrite=>1,prefix=>'model'(?:,\w+=>{VALUE})*\}}\)"
    r"|readFile\(\{file=>'model\.bngl',skip_actions=>1\}\)",
    re.IGNORECASE | re.ASCII,
)


def dangers(files):
    """What of the files that BioNetGen gets is evaluated and more than constants, or names a file of a function."""
    said = evaluated(files["model.bngl"], skips_actions=True) + evaluated(files["generate.bngl"], skips_actions=False)
    found = [code for code in said if not CONSTANT.fullmatch(code)]
    return found + re.findall(r"(?i)tfun|FunctionProduct", files["model.bngl"])


def imports(text, is_newer):
    """Whether Antimony's lexer meets an import: of 3.3, which knows texts in ``` and \\", or of one before."""
    data, place, last = text.split("\0")[0] + "\n\n", 0, ""
    while place < len(data) - 2:
        at, place = data[place], place + 1
        if at == "\\" and data[place] in "\r\n ":
            while data[place] in "\r\n " and place < len(data) - 1:
                place += 1
        elif (at == "/" and data[place] == "/") or at == "#":
            while data[place] not in "\r\n":
                place += 1
        elif at == "/" and data[place] == "*":
            end = data.find("*/", place + 1)
            place = len(data) if end < 0 else end + 2
        elif at.isascii() and (at.isalpha() or at == "_"):
            first = place - 1
            while data[place].isascii() and (data[place].isalnum() or data[place] == "_"):
                place += 1
            last = data[first:place]
            if last == "import":
                return True
        elif at.isascii() and at.isdigit():
            number = re.compile(r"[0-9]*\.?[0-9]*(?:[eE][-+]?[0-9]+)?").match(data, place)
            place = number.end()
        elif at == "-" and data[place] == "o":
            place += 1
        elif is_newer and data.startswith("```", place - 1) and data.find("```", place + 2) > 0:
            place = data.find("```", place + 2) + 3
            if last.lower() == "import":
                return True
        elif at == '"':
            ended = re.compile(r'(?:[^"\\\r\n]|\\.)*"' if is_newer else r'[^"\r\n]*"').match(data, place)
            if ended:
                if last.lower() == "import":
                    return True
                place = ended.end()
        elif at == "`" and not is_newer:
            return False  # a syntax error, behind which nothing is read
        elif at not in " \t\r\n":
            last = ""
    return False
