#!/usr/bin/python3
"""Write the manual as plain HTML: the Markdown pages of the tree, the man pages, the pictures. At the end, follow every link.

    manual.py SOURCE OUT MAN PAGE.md...     pages relative to SOURCE; MAN: folder of man pages; OUT/api: Doxygen's pages, made before
"""
import html
import os
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import markdown

source, out, man, *pages = sys.argv[1:]
MENU = {'Knead': 'README.html', 'Tutorials': 'README.html#ten-minutes', 'Commands': 'man/index.html', 'Clients': 'clients/README.html',
        'Server': 'server/README.html', 'Scenes': 'core/scenes/README.html', 'Wire': 'proto/README.html', 'Circuit': 'hdl/README.html',
        'C functions': 'api/files.html'}


def write(path, title, body):
    def up(to):
        return os.path.relpath(to, os.path.dirname(path) or '.')
    menu = ''.join(f'<li><a href="{up(to)}">{name}</a></li>' for name, to in MENU.items())
    Path(out, path).parent.mkdir(parents=True, exist_ok=True)
    Path(out, path).write_text(f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{html.escape(title)}</title>\n'
                               '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
                               f'<link rel="stylesheet" href="{up("manual.css")}"></head>\n'
                               f'<body><main><nav><ul>{menu}</ul></nav>\n{body}\n</main></body></html>\n')


def place(page, link):
    """Return where a link of a page leads in the manual, or None for a source file, which is not in the manual."""
    to, _, anchor = link.partition('#')
    path = os.path.normpath(os.path.join(os.path.dirname(page), to))
    if '://' in link or not to:
        return link
    if os.path.isdir(os.path.join(source, path)):
        path += '/README.md'
    header = f'api/{os.path.basename(path).replace("_", "__").replace(".", "_8")}.html'
    if path in pages:
        path = path[:-3] + '.html'
    elif path.endswith('.png'):
        Path(out, path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(os.path.join(source, path), os.path.join(out, path))
    elif os.path.exists(os.path.join(out, header)):
        path = header
    elif os.path.exists(os.path.join(source, path)):
        return None
    return os.path.relpath(path, os.path.dirname(page) or '.') + ('#' + anchor if anchor else '')


class Links(HTMLParser):
    def __init__(self, path):
        super().__init__()
        self.ids, self.links = {''}, set()
        self.feed(Path(out, path).read_text())

    def handle_starttag(self, _, attributes):
        self.ids.update(value for name, value in attributes if name in ('id', 'name'))
        self.links.update(unquote(value) for name, value in attributes
                          if name in ('href', 'src') and value and not re.match('[a-z]+:', value))


def leads(path, link):
    return path in found and (not found[path] or link.partition('#')[2] in found[path].ids)


for page in pages:
    text = Path(source, page).read_text()
    body = markdown.markdown(text, extensions=['tables', 'fenced_code', 'sane_lists', 'toc'])
    body = re.sub('<a href="([^"]+)">(.*?)</a>', flags=re.S, string=body,
                  repl=lambda m: f'<a href="{place(page, m[1])}">{m[2]}</a>' if place(page, m[1]) else m[2])
    body = re.sub('(<img [^>]*src=")([^"]+)', lambda m: m[1] + place(page, m[2]), body)
    body = body.replace('<table>', '<div class="scroll"><table>').replace('</table>', '</table></div>')
    write(page[:-3] + '.html', text.partition('\n')[0].lstrip('# '), body)
shutil.copy(os.path.join(out, 'README.html'), os.path.join(out, 'index.html'))

rows = ''
for path in sorted(Path(man).glob('*/*')):
    name = path.name
    body = subprocess.check_output(['mandoc', '-T', 'html', '-O', 'fragment', path], text=True)
    write(f'man/{name}.html', name, re.sub(r'\b(knead[a-z-]*)\((\d)\)', r'<a href="\1.\2.html">\1(\2)</a>', body))
    what = re.search(r'(?s)NAME</a></h1>.*? - (.*?)</', body)[1]
    rows += f'<tr><td><a href="{name}.html">{name}</a></td><td>{what}</td></tr>'
write('man/index.html', 'Commands', f'<h1>Commands</h1>\n<table>{rows}</table>')

found = {os.path.relpath(os.path.join(folder, name), out): None for folder, _, names in os.walk(out) for name in names}
found.update((path, Links(path)) for path in found if path.endswith('.html'))
broken = [f'{path}: {link}' for path, page in found.items() if page for link in sorted(page.links)
          if not leads(os.path.normpath(os.path.join(os.path.dirname(path), link.partition('#')[0] or os.path.basename(path))), link)]
print(f'{sum(map(bool, found.values()))} pages, {sum(len(page.links) for page in found.values() if page)} links', *broken,
      sep='\nbroken: ')
sys.exit(bool(broken))
