#!/usr/bin/env python3
"""Read the public headers and write what they declare, so that no declaration is written twice.

    declare.py abi SOURCE             the text of core/libknead.abi: functions, tables, enums and struct layouts
    declare.py ctypes SOURCE VERSION  the module knead/_api.py of the Python package

SOURCE is the project's folder. The C preprocessor ($CC or cc) reads core/knead.h.
"""
import ctypes
import os
import re
import subprocess
import sys
import tempfile

PLAIN = {'double': 'c_double', 'float': 'c_float', 'int': 'c_int', 'long': 'c_long', 'unsigned': 'c_uint', 'bool': 'c_bool',
         '_Bool': 'c_bool', 'char': 'c_char', 'size_t': 'c_size_t', 'int8_t': 'c_int8', 'uint8_t': 'c_uint8',
         'int16_t': 'c_int16', 'uint16_t': 'c_uint16', 'int32_t': 'c_int32', 'uint32_t': 'c_uint32',
         'int64_t': 'c_int64', 'uint64_t': 'c_uint64'}


def preprocess(source, *flags):
    """Return the preprocessed text of core/knead.h without the system's headers."""
    with tempfile.TemporaryDirectory() as empty:
        for name in ('stdbool', 'stddef', 'stdint', 'math', 'string'):
            open(os.path.join(empty, name + '.h'), 'w').close()
        return subprocess.run([os.environ.get('CC', 'cc'), '-E', '-P', '-nostdinc', '-I', empty, '-I', source,
                               '-D_Static_assert(...)=', '-Dstatic_assert(...)=', *flags,
                               os.path.join(source, 'core/knead.h')], check=True, capture_output=True, text=True).stdout


def declarations(text):
    """Yield the declarations of the text, without the bodies of inline functions."""
    depth, begin, i = 0, 0, 0
    for i, c in enumerate(text):
        depth += (c == '{') - (c == '}')
        if depth == 0 and c == ';':
            yield ' '.join(text[begin:i].split())
            begin = i + 1
        if depth == 0 and c == '}' and text[begin:i].lstrip().startswith('static'):
            begin = i + 1


class Api:
    """What the headers declare, in their order."""

    def __init__(self, source):
        self.enums, self.structs, self.functions, self.tables, self.constants = {}, {}, {}, {}, {}
        self.known = {}  # value of each name of an enum
        for one in declarations(preprocess(source)):
            self.declare(one)
        for name, value in re.findall(r'#define (KN_\w+) ([-+.\w()<<\s]+)$', preprocess(source, '-dM'), re.M):
            try:
                self.constants[name] = eval(value, {}, {})  # numbers and shifts only, by the pattern
            except (NameError, SyntaxError, TypeError):
                pass

    def declare(self, text):
        if match := re.fullmatch(r'(?:typedef )?enum ?\w* ?\{(.*)\} ?(\w*)', text):
            known, value = {}, -1
            for item in filter(None, (x.strip() for x in match[1].split(','))):
                name, _, given = item.partition('=')
                value = eval(given, {}, self.known) if given else value + 1
                known[name.strip()] = self.known[name.strip()] = value
            self.enums[match[2] or next(iter(known))] = known
        elif match := re.fullmatch(r'(?:typedef )?struct (\w+) \{(.*)\}(?: \w+)?', text):
            self.structs.pop(match[1], None)  # a struct follows those that it contains
            self.structs[match[1]] = [field for line in match[2].split(';') if line.strip()
                                      for field in self.variables(line)]
        elif match := re.fullmatch(r'(?:typedef )?struct (\w+)(?: \w+)?', text):
            self.structs.setdefault(match[1], None)
        elif match := re.fullmatch(r'extern (.*)', text):
            for name, kind in self.variables(match[1]):
                self.tables[name] = kind
        elif match := re.fullmatch(r'([\w *]+?[ *]+)(kn_\w+)\((.*)\)', text):
            if text.startswith('typedef'):
                return
            arguments = [] if match[3] == 'void' else [list(self.variables(a, True))[0]
                                                        for a in re.split(r',(?![^()]*\))', match[3])]
            self.functions[match[2]] = (next(self.variables(match[1] + ' result'))[1], arguments)
        elif text and not text.startswith('static'):
            raise SystemExit(f'declare.py: cannot read "{text[:100]}", expected a declaration of the forms in core/')

    def variables(self, line, argument=False):
        """Yield name and type of each variable that a line declares. A type is a text for ctypes."""
        words = re.match(r'\s*((?:(?:const|struct|unsigned|\w+)\b\s*)+?)(?=\s*(?:\(?\s*\*|\w+\s*(?:$|[\[,:])))', line)
        base = [w for w in words[1].split() if w not in ('const', 'struct')][-1]
        base = 'uint8_t' if 'unsigned char' in words[1] else base
        for part in re.split(r',(?![^(]*\))', line[words.end():]):
            part = re.sub(r'\bconst\b', '', part).strip()
            if re.search(r'\(\s*\*\s*\w+\s*\)\s*\(', part):  # a pointer to a function
                yield re.search(r'\*\s*(\w+)', part)[1], 'c_void_p'
                continue
            outer = [int(eval(n, {}, self.known)) if n else 0 for n in re.findall(r'\[([^\]]*)\]', part)]
            to_array = re.match(r'\(\s*\*', part)
            stars = 0 if to_array else part.split('[')[0].count('*')
            name = re.search(r'(\w+)\s*\)?\s*(?:\[|$)', part)[1]
            kind = PLAIN.get(base) or ('c_int' if base in self.enums else base)
            if kind == base and base != 'void':
                self.structs.setdefault(base, None)
            if stars:
                kind = {'char': 'c_char_p', 'void': 'c_void_p'}.get(base) or f'POINTER({kind})'
                stars -= 1
            for _ in range(stars):
                kind = f'POINTER({kind})'
            if argument and outer and not to_array:
                outer[0] = None  # an array as an argument is a pointer
            for n in reversed(outer):
                kind = f'POINTER({kind})' if n is None or n == 0 else f'{kind} * {n}'
            yield name, f'POINTER({kind})' if to_array else kind

    def ctypes_text(self, version=''):
        lines = ['"""What the headers of libknead declare. Written by declare.py; do not edit."""',
                 'from ctypes import *', '', f'KN_VERSION = {version!r}']
        for name, value in sorted(self.constants.items()):
            lines.append(f'{name} = {value!r}')
        for values in self.enums.values():
            lines += [f'{name} = {value}' for name, value in values.items()]
        lines += [f'class {name}(Structure):\n    pass' for name in self.structs]
        lines += [f'{name}._fields_ = [' + ', '.join(f'("{n}", {t})' for n, t in fields) + ']'
                  for name, fields in self.structs.items() if fields]
        lines.append('FUNCTIONS = {')
        for name, (result, arguments) in self.functions.items():
            result = 'None' if result == 'void' else result
            lines.append(f'    "{name}": ({result}, [' + ', '.join(t for _, t in arguments) + ']),')
        return '\n'.join(lines + ['}', ''])

    def abi_text(self):
        module = {}
        exec(self.ctypes_text(), module)
        lines = [f'function {n} {r} ({", ".join(t for _, t in a)})' for n, (r, a) in sorted(self.functions.items())]
        lines += [f'table {n} {t}' for n, t in sorted(self.tables.items())]
        lines += [f'enum {n} ' + ', '.join(f'{k} {v}' for k, v in values.items())
                  for n, values in sorted(self.enums.items())]
        for name, fields in sorted(self.structs.items()):
            if not fields:
                continue
            kind = module[name]
            lines.append(f'struct {name} {ctypes.sizeof(kind)}')
            lines += [f'    {getattr(kind, n).offset} {n} {t}' for n, t in fields]
        return '\n'.join(lines) + '\n'


if __name__ == '__main__':
    if sys.argv[1:2] not in (['abi'], ['ctypes']) or len(sys.argv) != {'abi': 3, 'ctypes': 4}[sys.argv[1]]:
        sys.exit(__doc__)
    api = Api(sys.argv[2])
    print(api.abi_text() if sys.argv[1] == 'abi' else api.ctypes_text(sys.argv[3]), end='')
