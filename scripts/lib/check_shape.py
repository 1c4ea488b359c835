#!/usr/bin/env python3
"""Does the C++ keep its shape? Run by scripts/check_text; prints what is wrong, a line each, and exits with 1 then.

Functions of at most 80 lines and 6 parameters, classes of at most 250 lines, files of at most 500 lines of 120 columns, no comma
operator between statements. Reads tokens and brackets, not the language: macros stand for themselves, and what the preprocessor
would leave out is read, too.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]

MOST_FUNCTION_LINES, MOST_CLASS_LINES, MOST_FILE_LINES, MOST_COLUMNS, MOST_PARAMETERS = 80, 250, 500, 120, 6

# (start of the path, what: a function or class by name, "comma", "file" or "*"): why it may stay.
EXCEPTIONS = {
    ("libs/fusion/src/team/joint_transforms.cpp", "eval_h"): "Ipopt prescribes the signature",
    ("libs/fusion/src/team/joint_transforms.cpp", "finalize_solution"): "as eval_h",
    ("libs/scheduling/src/lower_bound.cpp", "eval_jac_g"): "as eval_h",
    ("libs/scheduling/src/lower_bound.cpp", "eval_h"): "as eval_h",
    ("libs/scheduling/src/lower_bound.cpp", "finalize_solution"): "as eval_h",
    ("libs/fusion/src/team/joint_transforms.cpp", "get_starting_point"): "as eval_h",
    ("libs/fusion/src/team/joint_transforms.cpp", "eval_jac_g"): "as eval_h",
    ("libs/scheduling/src/lower_bound.cpp", "get_starting_point"): "as eval_h",
}

TOKEN = re.compile(r"""
    (?P<skip>\s+ | //[^\n]* | /\*.*?\*/ | ^[ ]*\#(?:\\\n|[^\n])*)
  | (?P<text>(?:u8|[uUL])?R"(?P<mark>[^(\s]*)\(.*?\)(?P=mark)" | (?:u8|[uUL])?"(?:\\.|[^"\\\n])*" | '(?:\\.|[^'\\\n])+')
  | (?P<word>[A-Za-z_]\w*)
  | (?P<number>\.?\d(?:[eEpP][+-]|'(?=\w)|[\w.])*)
  | (?P<sign>::|->\*?|\+\+|--|&&|\|\||<=|>=|==|!=|<<=|<<|[-+*/%&|^]=|\.\.\.|.)
""", re.VERBOSE | re.DOTALL | re.MULTILINE)

CONTROL = {"if", "for", "while", "switch", "catch"}
AFTER_PARAMETERS = {"const", "noexcept", "override", "final", "mutable", "&", "&&", "try"}
NOT_A_CALL = CONTROL | {"return", "sizeof", "alignof", "decltype", "alignas", "static_assert", "noexcept", "throw"}
STARTS_DECLARATION = {"const", "constexpr", "static", "thread_local", "using", "typedef", "struct", "class", "enum", "union",
                      "auto", "typename", "extern", "inline", "friend", "template", "unsigned", "signed", "volatile"}
IN_TYPE = re.compile(r"(?:[A-Za-z_]\w*|\d\w*|::|<|>|>>|,|\*|&|&&|\.\.\.|\(|\))$")


class Token:
    __slots__ = ("text", "line", "kind", "mate")

    def __init__(self, text, line, kind):
        self.text, self.line, self.kind, self.mate = text, line, kind, None


def tokens_of(text):
    tokens, line, open_brackets = [], 1, []
    for found in TOKEN.finditer(text):
        kind, piece = found.lastgroup, found.group()
        if kind != "skip":
            token = Token('""' if kind == "text" else piece, line, kind)
            if piece in ("(", "[", "{"):
                open_brackets.append(len(tokens))
            elif piece in (")", "]", "}") and open_brackets:
                token.mate = open_brackets.pop()
                tokens[token.mate].mate = len(tokens)
            tokens.append(token)
        line += piece.count("\n")
    return tokens


class Source:
    def __init__(self, file, text):
        self.file, self.tokens, self.problems = file, tokens_of(text), []
        self.text_of = [token.text for token in self.tokens]
        lines = text.splitlines()
        if len(lines) > MOST_FILE_LINES:
            self.complain("file", 1, f"{len(lines)} lines; at most {MOST_FILE_LINES}, split it by idea")
        for number, line in enumerate(lines, 1):
            if len(line) > MOST_COLUMNS:
                self.complain("file", number, f"{len(line)} columns; at most {MOST_COLUMNS}")
        self.read_scope(0, len(self.tokens))

    def complain(self, what, line, why):
        if not any(self.file.startswith(start) and named in ("*", what) for start, named in EXCEPTIONS):
            self.problems.append(f"{self.file}:{line}: {why}")

    # Brackets and templates.

    def end_of_template(self, at, end):
        """Just after the > that closes the < at `at`, if this is a list of template arguments; else None."""
        depth = 0
        while at < end and IN_TYPE.match(self.text_of[at]):
            text = self.text_of[at]
            if text == "(" and self.tokens[at].mate is not None:
                at = self.tokens[at].mate
            elif text == ")":
                return None
            elif text == "<":
                depth += 1
            elif text == ">":
                depth -= 1
                if depth == 0:
                    return at + 1
            at += 1
        return None

    def pieces(self, begin, end):
        """[begin, end) cut at its commas: those within no brackets and no template arguments."""
        pieces, start, at = [], begin, begin
        while at < end:
            text, after = self.text_of[at], None
            if text in ("(", "[", "{") and self.tokens[at].mate is not None:
                after = self.tokens[at].mate + 1
            elif text == "<" and at > begin and self.tokens[at - 1].kind == "word":
                after = self.end_of_template(at, end)
            elif text == ",":
                pieces.append((start, at))
                start = at + 1
            at = after or at + 1
        return pieces + [(start, end)]

    def count_parameters(self, opening):
        begin, end = opening + 1, self.tokens[opening].mate
        return 0 if begin == end else len(self.pieces(begin, end))

    def is_lambda_introducer(self, opening):
        before = self.tokens[opening - 1] if opening > 0 else None
        if before is None or self.text_of[opening + 1] == "[" or before.text == "[":
            return False
        return before.text == "return" or not (before.kind in ("word", "number", "text") or before.text in (")", "]", "}", ">"))

    def introducer_of(self, brace):
        """Where the [ of the lambda stands whose body opens at `brace`; None: it is no lambda's."""
        at = brace - 1
        while at >= 0 and self.text_of[at] in AFTER_PARAMETERS:
            at -= 1
        if self.text_of[at] not in (")", "]"):   # a type that the lambda returns
            while at >= 0 and (IN_TYPE.match(self.text_of[at]) or self.text_of[at] == "const"):
                at -= 1
            if at < 0 or self.text_of[at] != "->":
                return None
            at -= 1
            while at >= 0 and self.text_of[at] in AFTER_PARAMETERS:
                at -= 1
        if self.text_of[at] == ")" and self.tokens[at].mate is not None:
            at = self.tokens[at].mate - 1
        if at >= 0 and self.text_of[at] == "]" and self.tokens[at].mate is not None and self.is_lambda_introducer(self.tokens[at].mate):
            return self.tokens[at].mate
        return None

    # Namespaces and classes.

    def read_scope(self, begin, end):
        """The declarations of a namespace or a class."""
        start, at = begin, begin
        while at < end:
            text, token = self.text_of[at], self.tokens[at]
            if text == ";" or (text == ":" and at > begin and self.text_of[at - 1] in ("public", "private", "protected")):
                self.read_declaration(start, at)
                start = at + 1
            elif text in ("(", "[") and token.mate is not None:
                self.read_inside(at + 1, token.mate)
                at = token.mate
            elif text == "{" and token.mate is not None:
                if self.read_braces_of_scope(start, at):
                    start = token.mate + 1
                at = token.mate
            at += 1

    def read_braces_of_scope(self, start, brace):
        """True where the declaration ends with these braces."""
        close = self.tokens[brace].mate
        words = self.without_template_heads(start, brace)
        top = [self.text_of[k] for k in words]
        function = self.function_in(words)
        if "namespace" in top or top[:1] == ["extern"] and len(top) == 2:
            self.read_scope(brace + 1, close)
            return True
        if function is None and "enum" in top:
            return False
        if function is None and any(text in ("class", "struct", "union") for text in top) and "=" not in top:
            self.read_class(words, brace)
            return False   # a ; follows
        if function is None or self.is_member_initializer(words, brace):
            self.read_inside(brace + 1, close)
            return False
        self.read_function(function, brace)
        return True

    def without_template_heads(self, start, end):
        """The indices of [start, end) without what stands in brackets (those stay) and without template<...>."""
        kept, at = [], start
        while at < end:
            if self.text_of[at] == "template":
                at = self.end_of_template(at + 1, end) or at + 1
                continue
            kept.append(at)
            at = self.tokens[at].mate if self.text_of[at] in ("(", "[", "{") and self.tokens[at].mate is not None else at + 1
        return kept

    def function_in(self, words):
        """Where the ( of a function's parameters stands in a declaration; None: there is none."""
        for place, at in enumerate(words):
            if self.text_of[at] == "=" and not (place > 0 and self.text_of[words[place - 1]] == "operator"):
                return None
            if self.text_of[at] != "(" or place == 0:
                continue
            before = self.tokens[words[place - 1]]
            if "operator" in [self.text_of[k] for k in words[max(0, place - 3):place]]:
                if self.text_of[at + 1] == ")" and at + 2 < len(self.text_of) and self.text_of[at + 2] == "(" and before.text == "operator":
                    continue
                return at
            if before.kind == "word" and before.text not in NOT_A_CALL and before.text != "__attribute__":
                return at
        return None

    def is_member_initializer(self, words, brace):
        """Whether the braces initialize a member in a constructor's list."""
        texts = [self.text_of[k] for k in words]
        return ":" in texts and self.text_of[brace - 1] not in (")", "}") and self.tokens[brace - 1].kind == "word" and ")" in texts

    def read_declaration(self, start, end):
        words = self.without_template_heads(start, end)
        if (function := self.function_in(words)) is not None and "using" not in [self.text_of[k] for k in words]:
            self.judge_parameters(function)

    def name_before(self, opening):
        before = self.tokens[opening - 1]
        return before.text if before.kind == "word" else "operator"

    def judge_parameters(self, opening):
        name, count = self.name_before(opening), self.count_parameters(opening)
        if count > MOST_PARAMETERS:
            self.complain(name, self.tokens[opening].line, f"{name} has {count} parameters; at most {MOST_PARAMETERS}")

    def read_class(self, words, brace):
        close = self.tokens[brace].mate
        name = next((self.text_of[k] for place, k in enumerate(words) if place > 0 and self.tokens[k].kind == "word" and
                     self.text_of[words[place - 1]] in ("class", "struct", "union")), "a class")
        lines = self.tokens[close].line - self.tokens[brace].line + 1
        if lines > MOST_CLASS_LINES:
            self.complain(name, self.tokens[brace].line, f"{name} has {lines} lines; at most {MOST_CLASS_LINES}")
        self.read_scope(brace + 1, close)

    def read_function(self, opening, brace):
        close, name = self.tokens[brace].mate, self.name_before(opening)
        self.judge_parameters(opening)
        lines = self.tokens[close].line - self.tokens[opening].line + 1
        if lines > MOST_FUNCTION_LINES:
            self.complain(name, self.tokens[opening].line, f"{name} has {lines} lines; at most {MOST_FUNCTION_LINES}")
        self.read_block(brace + 1, close)

    # Statements.

    def read_inside(self, begin, end):
        """Expressions, for the bodies of the lambdas in them."""
        at = begin
        while at < end:
            if self.text_of[at] == "{" and self.tokens[at].mate is not None:
                if (introducer := self.introducer_of(at)) is not None:
                    self.read_lambda(introducer, at)
                    at = self.tokens[at].mate
            at += 1

    def read_lambda(self, introducer, brace):
        after = self.tokens[introducer].mate + 1
        if self.text_of[after] == "(" and (count := self.count_parameters(after)) > MOST_PARAMETERS:
            self.complain("lambda", self.tokens[after].line, f"a lambda has {count} parameters; at most {MOST_PARAMETERS}")
        self.read_block(brace + 1, self.tokens[brace].mate)

    def read_block(self, begin, end):
        start, at = begin, begin   # of the statement
        while at < end:
            text, token = self.text_of[at], self.tokens[at]
            if text == ";":
                self.read_statement(start, at)
                start = at + 1
            elif text in ("else", "do", "try") and at == start:
                start = at + 1
            elif text == ":" and self.text_of[start] in ("case", "default"):
                start = at + 1
            elif text in ("(", "[") and token.mate is not None:
                if text == "(" and at > start and self.heads_control(start, at):
                    self.read_head(start, at)
                    start = token.mate + 1
                at = token.mate
            elif text == "{" and token.mate is not None:
                if at == start:
                    self.read_block(at + 1, token.mate)
                    start = token.mate + 1
                elif self.text_of[start] in ("struct", "class", "union") and self.text_of[at - 1] != "=" and "=" not in self.text_of[start:at]:
                    self.read_class(list(range(start, at)), at)
                at = token.mate
            at += 1

    def heads_control(self, start, opening):
        return self.text_of[start] in CONTROL and all(self.text_of[k] in CONTROL | {"constexpr"} for k in range(start, opening))

    def read_head(self, start, opening):
        """What stands in the brackets of an if, a for or the like: `for (...; ++a, ++b)` alone may have a comma."""
        begin, end = opening + 1, self.tokens[opening].mate
        self.read_inside(begin, end)
        if self.text_of[start] == "catch":
            return
        cuts = [k for k in self.top_level(begin, end) if self.text_of[k] == ";"]
        for first, last in zip([begin] + [cut + 1 for cut in cuts], cuts + [end]):
            if self.text_of[start] != "for":
                self.find_comma(first, last)

    def top_level(self, begin, end):
        at = begin
        while at < end:
            yield at
            at = self.tokens[at].mate + 1 if self.text_of[at] in ("(", "[", "{") and self.tokens[at].mate is not None else at + 1

    def read_statement(self, start, end):
        self.read_inside(start, end)
        self.find_comma(start, end)

    def find_comma(self, start, end):
        if start == end or self.is_declaration(start, end) or len(cut := self.pieces(start, end)) == 1:
            return
        if not self.fills_matrix(start, cut):
            self.complain("comma", self.tokens[cut[1][0] - 1].line, "a comma between statements; each gets its own line")

    def fills_matrix(self, start, pieces):
        """`matrix << a, b, c`, as Eigen and OpenCV have it."""
        signs = [[self.text_of[k] for k in self.top_level(*piece)] for piece in pieces]
        return self.text_of[start] != "return" and "<<" in signs[0] and not any(
            {"=", "+=", "-=", "++", "--", "<<"} & set(piece) for piece in [signs[0][:signs[0].index("<<")], *signs[1:]])

    def is_declaration(self, start, end):
        """A type, which may be qualified and have template arguments, and a name after it: `at[place] = x, ...` is none."""
        if self.text_of[start] in STARTS_DECLARATION:
            return True
        at = start
        while True:
            if at < end and self.text_of[at] == "::":
                at += 1
            if at >= end or self.tokens[at].kind != "word" or self.text_of[at] in NOT_A_CALL | {"delete", "new"}:
                return False
            at += 1
            if at < end and self.text_of[at] == "<":
                after = self.end_of_template(at, end)
                if after is None:
                    return False
                at = after
            if at >= end or self.text_of[at] != "::":
                break
        while at < end and self.text_of[at] in ("*", "&", "&&", "const"):
            at += 1
        return at < end and self.tokens[at].kind == "word"


def sources():
    names = subprocess.run(["git", "-C", ROOT, "ls-files", "-z", "--cached", "--others", "--exclude-standard",
                            "libs/*.h", "libs/*.cpp", "apps/*.h", "apps/*.cpp", "test/*.h", "test/*.cpp"],
                           capture_output=True, text=True, check=True).stdout.split("\0")
    return [name for name in sorted(set(names)) if name and (ROOT / name).is_file()]


def main():
    problems = [problem for name in sources() for problem in Source(name, (ROOT / name).read_text()).problems]
    print(*problems, sep="\n", end="\n" if problems else "")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
