"""Small SBML documents of our own, made by libsbml."""

from kinetics.formats import read


class Builder:
    """A small SBML document."""

    def __init__(self, level=3, version=2, size=1.0):
        import libsbml

        self.sbml = libsbml
        self.document = self.sbml.SBMLDocument(level, version)
        self.model = self.document.createModel()
        self.model.setId("m")
        self.level = level
        self.compartment("cell", size)

    def compartment(self, name, size, *, constant=True, dimensions=3):
        place = self.model.createCompartment()
        place.setId(name)
        place.setSpatialDimensions(dimensions)
        if size is not None:
            place.setSize(size)
        place.setConstant(constant)

    def species(
        self, name, amount=0.0, *, concentration=None, by_amount=True, boundary=False, constant=False, place="cell"
    ):
        each = self.model.createSpecies()
        each.setId(name)
        each.setCompartment(place)
        if concentration is not None:
            each.setInitialConcentration(concentration)
        elif amount is not None:
            each.setInitialAmount(amount)
        each.setHasOnlySubstanceUnits(by_amount)
        each.setBoundaryCondition(boundary)
        each.setConstant(constant)
        return each

    def parameter(self, name, value=None, *, constant=True):
        each = self.model.createParameter()
        each.setId(name)
        each.setConstant(constant)
        if value is not None:
            each.setValue(value)

    def reaction(self, name, before, after, law, *, reversible=False, ids=None, **local):
        """ids : species -> id of the reference to it, whose stoichiometry may then be set elsewhere"""
        each = self.model.createReaction()
        each.setId(name)
        each.setReversible(reversible)
        if self.level < 3 or self.document.getVersion() < 2:
            each.setFast(False)
        named = set()
        for side, add in ((before, each.createReactant), (after, each.createProduct)):
            for species, copies in side.items():
                reference = add()
                reference.setSpecies(species)
                if copies is not None:
                    reference.setStoichiometry(copies)
                if self.level > 2:
                    reference.setConstant(species not in (ids or {}))
                if species in (ids or {}):
                    reference.setId(ids[species])
                named.add(species)
        for i in range(self.model.getNumSpecies()):
            other = self.model.getSpecies(i).getId()
            if other in law and other not in named:
                each.createModifier().setSpecies(other)
        kinetic = each.createKineticLaw()
        kinetic.setMath(self.sbml.parseL3Formula(law))
        for key, value in local.items():
            own = kinetic.createLocalParameter() if self.level > 2 else kinetic.createParameter()
            own.setId(key)
            own.setValue(value)
        return each

    def rule(self, variable, formula, make="createAssignmentRule"):
        rule = getattr(self.model, make)()
        if variable:
            rule.setVariable(variable)
        if formula is not None:
            rule.setMath(self.sbml.parseL3Formula(formula))

    def assignment(self, symbol, formula):
        start = self.model.createInitialAssignment()
        start.setSymbol(symbol)
        start.setMath(self.sbml.parseL3Formula(formula))

    def function(self, name, formula):
        function = self.model.createFunctionDefinition()
        function.setId(name)
        function.setMath(self.sbml.parseL3Formula(formula))

    def event(self, name, when, delay=None, priority=None, persistent=True, initial=True, at_trigger=True, **assign):
        event = self.model.createEvent()
        event.setId(name)
        event.setUseValuesFromTriggerTime(at_trigger)
        trigger = event.createTrigger()
        if when is not None:
            trigger.setMath(self.sbml.parseL3Formula(when))
        if self.level > 2:
            trigger.setInitialValue(initial)
            trigger.setPersistent(persistent)
        for given, make in ((delay, event.createDelay), (priority, event.createPriority)):
            if given is not None:
                make().setMath(self.sbml.parseL3Formula(given))
        for variable, formula in assign.items():
            change = event.createEventAssignment()
            change.setVariable(variable)
            change.setMath(self.sbml.parseL3Formula(formula))
        return event

    def read(self, folder, copies_per_unit=None):
        path = folder / "model.xml"
        path.write_text(self.sbml.writeSBMLToString(self.document), encoding="utf-8")
        return read(path, copies_per_unit)


def both_ways(law="k*X - p*Y", *, reversible=True, size=1.0, by_amount=True):
    """What builds one reaction X -> Y with this law, where k = 0.6, p = 0.2."""

    def build():
        made = Builder(size=size)
        made.species("X", 100, by_amount=by_amount)
        made.species("Y", 0, by_amount=by_amount)
        made.parameter("k", 0.6)
        made.parameter("p", 0.2)
        made.reaction("turn", {"X": 1}, {"Y": 1}, law, reversible=reversible)
        return made

    return build
