"""A schema whose constraints say outright what PER sees of them: one range, one size, no serial constraint.

A codec that reads `SIZE` on a reference, a union or an earlier extension marker wrongly reads this rightly. So a difference
is explained by a constraint exactly where the same codec agrees as soon as the constraint is written this way.
"""

from dataclasses import replace

from asn1.model import types as t
from tests.asn1.ranges import Allowed, Kept, numbers, sizes, unfold


def effective(schema: t.Schema) -> t.Schema:
    form = _Effective(schema)
    return replace(schema, modules={key: form.module(one) for key, one in schema.modules.items()})


class _Effective:
    def __init__(self, schema: t.Schema) -> None:
        self._schema = schema

    def module(self, module: t.Module) -> t.Module:
        identifiers = [self._identifier(one) for one in module.classes.values()]
        definitions = [replace(one, type=self.type(one.type)) for one in module.definitions.values()]
        return replace(
            module,
            definitions={one.name: one for one in (*identifiers, *definitions)},
            classes={
                name: replace(one, id_type=t.Reference(module.key, _identifier_name(one)))
                for name, one in module.classes.items()
            },
            sets={
                name: replace(one, rows=tuple(row._replace(type=self.type(row.type)) for row in one.rows))
                for name, one in module.sets.items()
            },
        )

    def _identifier(self, class_: t.ObjectClass) -> t.Definition:
        """In messages a table constraint always follows it: no extension marker is left (X.680 50.11)."""
        base, constraints = unfold(self._schema, class_.id_type)
        allowed = numbers(constraints)
        root = _values(allowed if isinstance(self._schema, Kept) else allowed._replace(is_extensible=False))
        return t.Definition(_identifier_name(class_), replace(base, constraints=root))

    def type(self, type_: t.Type) -> t.Type:
        if isinstance(type_, t.Reference) and not type_.constraints:
            return type_
        base, constraints = unfold(self._schema, type_)
        match base:
            case _ if isinstance(type_, t.ClassField):
                return type_
            case t.Sequence() | t.Choice():
                return replace(type_, constraints=()) if isinstance(type_, t.Reference) else self._inside(base)
            case t.Integer():
                return replace(base, constraints=_values(numbers(constraints)))
            case t.SequenceOf():
                return replace(base, element=self.type(base.element), constraints=_size(sizes(constraints)))
            case t.BitString() | t.OctetString():
                return replace(base, constraints=_size(sizes(constraints)))
        return type_

    def _inside(self, type_: t.Sequence | t.Choice) -> t.Type:
        root = tuple(map(self._component, type_.root))
        additions = tuple(map(self._addition, type_.additions))
        if isinstance(type_, t.Choice):
            return replace(type_, constraints=(), root=root, additions=additions)
        tail = tuple(map(self._component, type_.tail))
        return replace(type_, constraints=(), root=root, additions=additions, tail=tail)

    def _addition(self, addition: t.Component | t.Group) -> t.Component | t.Group:
        if isinstance(addition, t.Component):
            return self._component(addition)
        return replace(addition, components=tuple(map(self._component, addition.components)))

    def _component(self, component: t.Component) -> t.Component:
        """Where it has a default, the type itself: asn1tools reads TRUE only beside BOOLEAN."""
        type_ = component.type
        if component.default is not None:
            base, constraints = unfold(self._schema, type_)
            type_ = replace(base, constraints=constraints)
        return replace(component, type=self.type(type_))


def _identifier_name(class_: t.ObjectClass) -> str:
    return f"{class_.name}-Id"


def _values(allowed: Allowed) -> tuple[t.Constraint, ...]:
    if allowed.low is None and allowed.high is None:
        return ()
    return (t.Constraint(t.Values((t.Range(allowed.low, allowed.high),)), allowed.is_extensible),)


def _size(allowed: Allowed) -> tuple[t.Constraint, ...]:
    if not allowed.low and allowed.high is None:
        return ()
    within = t.Constraint(t.Values((t.Range(allowed.low, allowed.high),)), allowed.is_extensible)
    return (t.Constraint(t.Size(within)),)
